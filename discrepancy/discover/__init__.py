"""What no name explains: terms in a name's place or beside all."""
