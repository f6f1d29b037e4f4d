"""What the bellow families share: the wall's profile, revolved meshes, collision shapes."""
