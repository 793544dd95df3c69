"""The gyroscope as other programs describe one: the numbers of a datasheet in their formats."""
