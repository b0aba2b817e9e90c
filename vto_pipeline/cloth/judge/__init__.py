"""What the judge after the fact measures with: formulas of its own, shared with no solver and no collision."""
