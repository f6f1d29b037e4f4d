"""The evidence loop on recordings of measured hardware."""
