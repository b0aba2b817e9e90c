"""What survives, and what does not: every method on stiff, distorted and extreme cloth. `table.rows` measures."""
