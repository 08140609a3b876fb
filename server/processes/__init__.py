"""Starting our own processes, talking to them and ending them."""
