"""What a run in whole-angle mode shows beyond its errors, by what its rate does: Allan deviation, bias over the
pattern's angle, scale factor. One file a kind in ``kinds``."""
