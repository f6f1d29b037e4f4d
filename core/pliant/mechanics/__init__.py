"""Chain mechanics for all engines: rotations, kinematics, efforts, statics."""
