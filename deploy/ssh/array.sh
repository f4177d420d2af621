#!/bin/sh
# What a host without a queue runs for each task. A site's `template` may name another script instead; one line of it
# must be @script@ alone, where the work goes.
@script@
