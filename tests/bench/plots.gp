# gnuplot -c plots.gp FOLDER: draws FOLDER/plots/*.dat, which bench_solver wrote, as SVG.
folder = ARG1
set terminal svg size 1100,520 dynamic background rgb "white" font "DejaVu Sans,13"
set grid
set autoscale xfixmin
set autoscale xfixmax
set key outside right top Left reverse
set pointsize 0.6
ms(us) = us / 1000
is_there(file) = int(system(sprintf("test -s '%s' && echo 1 || echo 0", file)))
data(name) = sprintf("%s/plots/%s.dat", folder, name)
picture(name) = sprintf("%s/%s.svg", folder, name)
count(file) = int(system(sprintf("grep -c '^\"[^\"]*\"$' '%s'", file)))

file = data("peers")
if (is_there(file)) {
  set output picture("peers")
  set title "Pulled box, one thread (dashed: Bullet)"
  set xlabel "nodes"; set ylabel "CPU ms per simulated ms"; set logscale xy
  blocks = count(file)
  peers = int(system(sprintf("grep -c '^\"Bullet[^\"]*\"$' '%s'", file)))
  plot for [i=0:peers-1] file index i using 2:(ms($3) / $4) with linespoints lw 2 dashtype 2 title columnheader(1), \
    for [i=peers:blocks-1] file index i using 2:(ms($3) / $4) with linespoints lw 2 title columnheader(1), \
    1 with lines dashtype 3 lc rgb "black" title "real time"
}
file = data("nodes")
if (is_there(file)) {
  set output picture("nodes")
  set title "Step time against nodes (CPU, one thread)"
  set xlabel "nodes"; set ylabel "ms per 1 ms step"; set logscale xy
  plot for [i=0:count(file)-1] file index i using 2:(ms($4)) with linespoints lw 2 title columnheader(1), \
    1 with lines dashtype 3 lc rgb "black" title "real time"
}
unset logscale
set yrange [0:*]
file = data("graded")
if (is_there(file)) {
  set output picture("graded")
  set title "A graded tick's solve against nodes, one contact (CPU, one thread; dashed: near)"
  set xlabel "nodes"; set ylabel "ms per 1 ms tick"
  plot for [i=0:count(file)-1] file index i using 2:(ms($4)) with linespoints lw 2 title columnheader(1).", far", \
    for [i=0:count(file)-1] file index i using 2:(ms($3)) with linespoints lw 2 dashtype 2 title columnheader(1).", near"
}
file = data("contacts")
if (is_there(file)) {
  set output picture("contacts")
  set title "Tick time against contacts (CPU, one thread)"
  set xlabel "contacts"; set ylabel "ms per 1 ms tick"
  plot for [i=0:count(file)-1] file index i using 2:(ms($4)) with linespoints lw 2 title columnheader(1)
}
file = data("queue")
if (is_there(file)) {
  set output picture("queue")
  set title "Parts of a tick, lattice 30 x 15 x 30 (CPU, one thread)"
  set xlabel "moving nodes"; set ylabel "ms per 1 ms tick"
  plot file index 0 using 2:(ms($3)) every ::1 with linespoints lw 2 title "inputs and contacts", \
    file index 0 using 2:(ms($4)) every ::1 with linespoints lw 2 title "queue", \
    file index 0 using 2:(ms($5)) every ::1 with linespoints lw 2 title "solve", \
    file index 0 using 2:(ms($6)) every ::1 with linespoints lw 2 title "all three"
}
