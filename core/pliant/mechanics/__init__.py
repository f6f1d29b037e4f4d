"""Chain mechanics that all engines share: rotations, kinematics, efforts, statics."""
