"""Pictures, films and the interactive viewer: MuJoCo draws, whatever engine simulated."""
