"""How connections reach the application: the listening socket, their limits, and the proxies in front."""
