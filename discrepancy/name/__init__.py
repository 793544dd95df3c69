"""The search for effects: scored, refitted, accepted, questioned."""
