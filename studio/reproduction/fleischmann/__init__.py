"""The figures and tables of Fleischmann, Austvoll & Kwolek (2012), one file each."""
