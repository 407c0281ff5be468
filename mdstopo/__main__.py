"""`python -m mdstopo` is `mdstopo`."""

from mdstopo.cli import main

if __name__ == "__main__":
    main()
