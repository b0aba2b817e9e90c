"""From photos, depth frames and clouds to a surface in metres."""
