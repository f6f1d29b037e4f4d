"""The evidence loop for MuJoCo models: `model: {kind: mjcf, file: robot.xml}`."""
