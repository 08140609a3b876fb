"""Laws that the results of a walk must obey, whatever the person: where one is broken, a result is wrong."""
