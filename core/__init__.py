"""Pure gait science: arrays in, arrays out. No sockets, no database, no clock, no global random."""
