"""Controllers: from the estimates of an observer to the force on the device."""
