"""Observers: from force and sensor voltage to the state and the parameters of the device."""
