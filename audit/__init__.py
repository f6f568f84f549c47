"""What others wrote and pomona brings along: under which licences, and what is known to be wrong with it."""
