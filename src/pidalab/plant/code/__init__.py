"""What other machines take of a digital controller: C, structured text and Python with a test, and JSON.

`pidalab.digital.DigitalController` has the methods that write, and `pidalab.digital.from_json` reads.
"""
