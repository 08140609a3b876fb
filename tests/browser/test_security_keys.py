"""Security keys in Chromium with its virtual USB authenticator."""

from __future__ import annotations

import pyotp
from playwright.sync_api import Browser, expect

from tests.browser.conftest import PASSWORD, RunningServer

WHO = "keyed"


def test_a_key_is_set_up_signs_in_and_is_removed(flat: Browser, running: RunningServer) -> None:
    here = running.url.replace("127.0.0.1", "localhost")
    with running.client() as client:
        response = client.post("/api/v1/users", json={"name": WHO, "role": "viewer", "password": PASSWORD})
        response.raise_for_status()
    context = flat.new_context(base_url=here, locale="en-US")
    try:
        page = context.new_page()
        session = context.new_cdp_session(page)
        session.send("WebAuthn.enable")
        usb = {"protocol": "ctap2", "transport": "usb", "hasResidentKey": False, "hasUserVerification": False}
        options = usb | {"automaticPresenceSimulation": True}
        key = session.send("WebAuthn.addVirtualAuthenticator", {"options": options})["authenticatorId"]

        def sign_in() -> None:
            page.goto("/sign-in?next=/account")
            page.get_by_label("User name").fill(WHO)
            page.get_by_label("Password").fill(PASSWORD)
            page.get_by_role("button", name="Sign in", exact=True).click()

        sign_in()
        page.wait_for_url(f"{here}/account")  # loaded, with its scripts
        page.get_by_label("Current password").nth(1).fill(PASSWORD)
        page.get_by_role("button", name="Set up a second factor").click()
        dialog = page.locator("dialog[open]")
        secret = dialog.locator("[data-answer=secret]").inner_text()
        dialog.get_by_label("Code").fill(pyotp.TOTP(secret).now())
        dialog.get_by_role("button", name="Confirm").click()
        codes = dialog.locator("[data-answer=codes]").inner_text().split()
        with page.expect_navigation():
            page.locator("#factor-codes").get_by_role("button", name="Done").click()

        page.get_by_role("button", name="New key").click()
        dialog.get_by_label("Name").fill("Blue key")
        dialog.get_by_label("Current password").fill(PASSWORD)
        dialog.get_by_label("One-time code").fill(codes[0])
        dialog.get_by_role("button", name="Set up").click()
        keys = page.locator("section", has=page.locator("#h-keys"))
        expect(keys).to_contain_text("Blue key")
        expect(keys).to_contain_text("never")
        held = session.send("WebAuthn.getCredentials", {"authenticatorId": key})["credentials"]
        assert [one["rpId"] for one in held] == ["localhost"]

        context.clear_cookies()
        sign_in()
        page.get_by_role("button", name="Use a security key").click()
        page.wait_for_url(f"{here}/account")
        expect(keys).not_to_contain_text("never")

        # the key is at home
        context.clear_cookies()
        session.send("WebAuthn.removeVirtualAuthenticator", {"authenticatorId": key})
        session.send("WebAuthn.addVirtualAuthenticator", {"options": options})
        sign_in()
        page.get_by_role("button", name="Use a security key").click()
        expect(page.locator(".form-error")).to_contain_text("The key did not respond")
        assert "/sign-in" in page.url
    finally:
        context.close()
