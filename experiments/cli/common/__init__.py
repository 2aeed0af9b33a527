"""What several commands share: names for the help texts, types of options, checks of extras, tables."""
