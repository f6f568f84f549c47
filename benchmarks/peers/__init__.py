"""Other people's methods, run on what ours are run on."""
