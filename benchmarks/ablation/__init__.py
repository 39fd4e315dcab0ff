"""What each rule of the output-error fits buys: the same records with and without it."""
