"""Devices simulated by equations and an integrator of their own, to test the diagnosis on data that it did not make.

Nothing here that makes data imports the model, its generated C or the diagnosis; a test reads the imports.
"""
