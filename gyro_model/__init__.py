"""What the device is: quantities, effects, and everything made from them (C, XML, reference simulation,
documentation)."""
