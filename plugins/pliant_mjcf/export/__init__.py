"""Files of an improved MuJoCo model: the MJCF, a module for what it cannot say, predictions to check both."""
