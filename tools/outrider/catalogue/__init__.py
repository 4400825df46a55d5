"""What there is to fly and what was flown: takes shipped files and runs, gives lists and copies to edit."""
