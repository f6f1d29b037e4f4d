"""Tables of FEM states and of designs: columns, reading, writing."""
