"""How fast the parts are, each beside an opponent measured in the same minute."""
