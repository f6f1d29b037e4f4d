"""Hold and turn: fingers that hold an object turn it in the hand."""
