"""The answer: what it may claim, what would tell rivals apart, many devices together."""
