#!/bin/sh
# What Slurm runs for each task of an array. A site's `template` may name another script instead; one line of it must
# be @script@ alone, where the work goes. Options stand on sbatch's command line; #SBATCH lines here count after them.
FLYBY_TASK=$SLURM_ARRAY_TASK_ID
export FLYBY_TASK
@script@
