"""Targets of one's own: any number, class or event that a log or a folder's name tells, tested on groups apart.

* `read`: recordings as series of readings and truth, each in a group such as a person or a day;
* `features`: statistics of the window before a reading, and how long that window is;
* `models`: extra trees and ridge regression on these statistics, and the constant that they have to beat;
* `validate`: every group is tested once, by models that were trained and chosen on the other groups;
* `kept`: the model of all groups is kept, and predicts new logs.
"""
