"""Neural meta-model: one network of design, actuation and deformation."""
