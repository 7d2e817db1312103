"""Commands on the files of a project: begin, check, explain, draw, profiles and specs, what the harnesses need."""
