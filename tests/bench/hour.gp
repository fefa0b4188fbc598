# gnuplot -c hour.gp FOLDER: draws the table FOLDER/hour.md, which bench_hour wrote, as FOLDER/hour.svg.
table = ARG1."/hour.md"
set terminal svg size 1100,520 dynamic background rgb "white" font "DejaVu Sans,13"
set output ARG1."/hour.svg"
set datafile separator "|"
set grid
set key outside right top Left reverse
set title "A session in which two blades cut and a grasper draws, minute by minute (CPU, one thread)"
set xlabel "minutes of cutting"; set ylabel "ms per 1 ms tick"; set logscale y
# Each row begins with a bar, so that the first column is empty; two rows are the head.
plot table using 2:($5 / 1000) skip 4 with linespoints lw 2 title "tick, median", \
  table using 2:($6 / 1000) skip 4 with linespoints lw 2 title "tick, 99th percentile", \
  table using 2:($8 / 1000) skip 4 with linespoints lw 2 dashtype 2 title "of it contacts", \
  table using 2:($9 / 1000) skip 4 with linespoints lw 2 dashtype 3 title "of it solve", \
  1 with lines dashtype 3 lc rgb "black" title "real time"
