#!/bin/sh
# What Grid Engine runs for each task of an array. A site's `template` may name another script instead; one line of it
# must be @script@ alone, where the work goes. Options stand on qsub's command line; #$ lines here count after them.
FLYBY_TASK=$SGE_TASK_ID
export FLYBY_TASK
@script@
