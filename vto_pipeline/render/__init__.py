"""What is looked at: the detailed garment after the drape, and pictures."""
