"""L7S step with 27 × 27 matrices, equation by equation, as a reference for the compiled step."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sagittal.core.body.l7s.filter import L7sInputs, L7sParams, L7sState, Worn, start_l7s_state
from sagittal.core.body.l7s.legs import LegModel
from sagittal.core.frames import Floats

EYE = np.eye(3)
Z = EYE[2]

Row = tuple[Floats, float, float]
"""H (27,), residual, variance."""


def skew(a: Floats) -> Floats:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def exp3(phi: Floats) -> tuple[Floats, Floats]:
    """Exp(φ) and J_l(φ) by Rodrigues' formulas."""
    angle = float(np.linalg.norm(phi))
    K = skew(phi)
    if angle < 1e-6:
        return EYE + K + 0.5 * K @ K, EYE + 0.5 * K + K @ K / 6.0
    s, c = np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2
    return EYE + s * K + c * K @ K, EYE + c * K + (1.0 - s) / angle**2 * K @ K


def log3(R: Floats) -> Floats:
    angle = np.arccos(np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0))
    vee = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.asarray(0.5 * vee if angle < 1e-7 else 0.5 * angle / np.sin(angle) * vee)


def phi_of(xi: Floats) -> Floats:
    """Φ(ξ) = Σ (−1)^i/(i+1)! ad(ξ)^i (Sy 2021 eq 8)."""
    ad = np.zeros((6, 6))
    ad[:3, :3] = ad[3:, 3:] = skew(xi[3:])
    ad[:3, 3:] = skew(xi[:3])
    total, term = np.eye(6), np.eye(6)
    for i in range(1, 40):
        term = -term @ ad / (i + 1)
        total += term
        if np.abs(term).max() < 1e-18:
            break
    return total


class Textbook:
    """One step after the other: eq 3 to 5, 9 to 12, 28 to 31 as core/body/l7s/filter.py corrects them."""

    shares: ClassVar[tuple[float, float, float]] = (1.0, -0.5, -0.5)
    """Of pelvis, left and right foot in the row of the mid-pelvis (eq 18)."""

    def __init__(
        self, state: L7sState, model: LegModel, params: L7sParams, worn: Worn, rate_hz: float
    ) -> None:
        self.rate_hz = rate_hz
        self.R, self.p, self.v, self.P = state.R.copy(), state.p.copy(), state.v.copy(), state.P.copy()
        self.since = state.since.copy()
        self.model, self.params, self.worn = model, params, worn

    def step(self, measured: Floats, acc: Floats, still: Floats) -> None:
        self.predict(acc)
        rows = self.orientation(measured) + self.pelvis() + self.feet(still)
        if self.worn == "2I":
            rows += self.yaw()
        self.update(rows)
        for _ in range(self.params.projections):
            self.project()

    def predict(self, acc: Floats) -> None:
        dt, params = 1.0 / self.rate_hz, self.params
        F, Phi, Q = np.eye(27), np.eye(27), np.zeros((27, 27))
        for b in range(3):
            rho, phi, nu = slice(6 * b, 6 * b + 3), slice(6 * b + 3, 6 * b + 6), slice(18 + 3 * b, 21 + 3 * b)
            shift = dt * self.v[b] + 0.5 * dt**2 * acc[b]
            omega = np.concatenate((self.R[b].T @ shift, np.zeros(3)))
            F[rho, nu] = dt * self.R[b].T
            if params.adjoint == "printed":
                F[rho, phi] = skew(omega)
            Phi[6 * b : 6 * b + 6, 6 * b : 6 * b + 6] = phi_of(omega)
            G = np.zeros((27, 3))
            G[rho], G[nu] = 0.5 * dt**2 * self.R[b].T, dt * EYE
            Q += params.acceleration * G @ G.T
            Q[phi, phi] = params.orientation_step * EYE
            self.p[b] += shift
            self.v[b] += dt * acc[b]
        self.P = F @ self.P @ F.T + Phi @ Q @ Phi.T

    def orientation(self, measured: Floats) -> list[Row]:
        rows = []
        for b in range(0 if self.worn == "3I" else 1, 3):
            y = log3(self.R[b].T @ measured[b])
            for i in range(3):
                H = np.zeros(27)
                H[6 * b + 3 + i] = 1.0
                rows.append((H, float(y[i]), self.params.orientation))
        return rows

    def pelvis(self) -> list[Row]:
        rows = []
        for axis in range(2):
            H = np.zeros(27)
            for b, share in enumerate(self.shares):
                H[6 * b : 6 * b + 3] = share * self.R[b][axis]
            gap = self.p[0] - 0.5 * self.p[1] - 0.5 * self.p[2]
            rows.append((H, -float(gap[axis]), self.params.mid_pelvis))
        H = np.zeros(27)
        H[:3] = self.R[0][2]
        rows.append((H, self.model.hip_height - float(self.p[0, 2]), self.params.pelvis_height))
        return rows

    def feet(self, still: Floats) -> list[Row]:
        rows, params = [], self.params
        for f in (1, 2):
            self.since[f - 1] = 0.0 if still[f - 1] else self.since[f - 1] + 1.0
            H = np.zeros(27)
            H[6 * f : 6 * f + 3] = self.R[f][2]
            since_s = self.since[f - 1] / self.rate_hz
            rows.append((H, self.model.foot_height - float(self.p[f, 2]), self.height_variance(since_s)))
            for i in range(3 if still[f - 1] else 0):
                H = np.zeros(27)
                H[18 + 3 * f + i] = 1.0
                rows.append((H, -float(self.v[f, i]), params.zero_velocity))
        return rows

    def height_variance(self, since_s: float) -> float:
        """Of a foot's height, m², so long after its last flagged step (eq 20)."""
        fading = self.params.foot_swing * float(np.exp(-4.0 * since_s / self.params.decay_s))
        return max(fading, self.params.foot_floor) if since_s > 0.0 else self.params.foot_floor

    def yaw(self) -> list[Row]:
        t = (self.R[1] + self.R[2]) @ Z
        theta = np.arctan2(t[1], t[0])
        c, s = np.cos(theta), np.sin(theta)
        y = log3(self.R[0].T @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
        rows = []
        for i in range(3):
            H = np.zeros(27)
            H[3 + i] = 1.0
            for f in (1, 2):
                turned = -self.R[f] @ skew(Z)
                J = (t[0] * turned[1] - t[1] * turned[0]) / (t[0] ** 2 + t[1] ** 2)
                H[6 * f + 3 : 6 * f + 6] = -self.R[0][2, i] * J
            rows.append((H, float(y[i]), self.params.yaw))
        return rows

    def update(self, rows: list[Row]) -> None:
        H = np.array([row[0] for row in rows])
        y, variance = np.array([row[1] for row in rows]), np.diag([row[2] for row in rows])
        K = np.linalg.solve(H @ self.P @ H.T + variance, H @ self.P).T
        nu, left = K @ y, np.eye(27) - K @ H
        Phi = np.eye(27)
        for b in range(3):
            Phi[6 * b : 6 * b + 6, 6 * b : 6 * b + 6] = phi_of(nu[6 * b : 6 * b + 6])
        self.P = Phi @ (left @ self.P @ left.T + K @ variance @ K.T) @ Phi.T
        self.P = 0.5 * (self.P + self.P.T)
        self.inject(nu)

    def project(self) -> None:
        C, d, model = [], [], self.model
        for f, out in ((1, 0.5), (2, -0.5)):
            hip, ankle = np.array([0.0, out * model.hip_width, 0.0]), np.array([0.0, 0.0, -0.5 * model.foot])
            tau = self.p[0] + self.R[0] @ hip - self.p[f] - self.R[f] @ ankle
            of_p = np.hstack((self.R[0], -self.R[0] @ skew(hip)))
            of_f = -np.hstack((self.R[f], -self.R[f] @ skew(ankle)))
            y = self.R[f][:, 1]
            row = np.zeros(27)
            row[:6], row[6 * f : 6 * f + 6] = y @ of_p, y @ of_f
            row[6 * f + 3 : 6 * f + 6] -= tau @ self.R[f] @ skew(EYE[1])
            C.append(row)
            d.append(-float(y @ tau))
            length = model.thigh + model.shank
            if tau @ tau > length**2:
                row = np.zeros(27)
                row[:6], row[6 * f : 6 * f + 6] = 2.0 * tau @ of_p, 2.0 * tau @ of_f
                C.append(row)
                d.append(length**2 - float(tau @ tau))
        rows = np.array(C)
        self.inject(self.P @ rows.T @ np.linalg.solve(rows @ self.P @ rows.T, np.array(d)))

    def inject(self, nu: Floats) -> None:
        for b in range(3):
            turn, along = exp3(nu[6 * b + 3 : 6 * b + 6])
            self.p[b] += self.R[b] @ along @ nu[6 * b : 6 * b + 3]
            self.R[b] = self.R[b] @ turn
            self.v[b] += nu[18 + 3 * b : 21 + 3 * b]


def textbook(
    inputs: L7sInputs,
    model: LegModel,
    params: L7sParams,
    rate_hz: float,
    form_of: type[Textbook] = Textbook,
) -> tuple[Floats, Floats]:
    """Positions (n, 3, 3) and orientations (n, 3, 3, 3) by the form with matrices."""
    form = form_of(start_l7s_state(inputs, model, params), model, params, inputs.worn, rate_hz)
    p, R = np.empty((len(inputs.step), 3, 3)), np.empty((len(inputs.step), 3, 3, 3))
    for n in range(len(inputs.step)):
        form.step(inputs.R[n], inputs.acc[n], inputs.step[n])
        p[n], R[n] = form.p, form.R
    return p, R
