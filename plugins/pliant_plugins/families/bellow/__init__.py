"""Common parts of the bellow families: the wall's profile, revolved meshes, collision shapes."""
