"""Live takes: opened, logged, coached, filmed, and stored as recordings when they end."""
