"""Studies: reading YAML (`loading`), the typed study (`study`, `chain`), its errors (`problems`), its schema."""
