"""Server-rendered HTML using the same services as the API, one module per page; changes go through the
API.
"""
