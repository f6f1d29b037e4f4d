"""The evidence loop for models of your own: effects of inputs and outputs, and models that are Python functions."""
