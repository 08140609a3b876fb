"""Tables of text: their shape, the names of their columns, units of time, workbooks."""
