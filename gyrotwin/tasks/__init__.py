"""What each command does: a request becomes a result, the result becomes files. No command line in here."""
