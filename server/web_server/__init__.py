"""Network front end: listening socket, connection limits and trusted proxies."""
