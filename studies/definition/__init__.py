"""What a study is: its parameters, its sweep, the runs it asks for, their names."""
