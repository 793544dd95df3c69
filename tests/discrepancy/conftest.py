"""Makes ``hidden_sets`` importable from the tests below this folder."""
