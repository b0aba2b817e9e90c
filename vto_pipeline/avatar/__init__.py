"""The parametric body: template, shape, pose, measuring, and fitting it to what is known of a person."""
