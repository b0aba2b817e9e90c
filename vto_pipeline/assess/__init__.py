"""From a draped garment and a body to the numbers a fit engineer uses: ease, stretch, clearance."""
