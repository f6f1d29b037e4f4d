"""Tables that people bring: one reader of text, one table of units in names, one model of notes, schemas per use."""
