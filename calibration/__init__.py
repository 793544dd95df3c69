"""What records alone tell: temperature compensation, the frequency split from noise, figures of merit by fits."""
