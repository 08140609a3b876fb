"""What every request and every answer passes: guards, limits, headers, compression, problems."""
