"""Pages of accounts: sign-in, second factor, keys and tokens, users."""
