#include "server/lab/finite_elements/sparse_factors.h"

// These functions belong to GCC's libgomp, with which Debian builds CHOLMOD. They are declared here
// because clang finds an omp.h only beside a runtime of its own, which is not the one that is to be
// told.
extern "C" {
int omp_get_max_active_levels();
void omp_set_max_active_levels(int levels);
}

namespace trocar::finite_elements {
namespace {

// While one lives, parallel regions of OpenMP that this thread comes to run on this thread alone.
//
// CHOLMOD 3.0.14 gathers and scatters every supernode in parallel loops whose number of threads is
// compiled in (num_threads(4)), whatever OMP_NUM_THREADS or omp_set_num_threads() say. An organ has
// thousands of supernodes, each a few microseconds of such work: the threads put each other to
// sleep and wake each other, a hundred thousand times a second. A limit on nested levels of 0 is
// the only setting that a program can still make; it is of the calling thread, so nobody else's
// loops are touched. What a BLAS does with threads that are not OpenMP's stays as it is.
class OneThread {
 public:
  OneThread() : levels_before_(omp_get_max_active_levels()) { omp_set_max_active_levels(0); }
  ~OneThread() { omp_set_max_active_levels(levels_before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  const int levels_before_;
};

}  // namespace

SparseFactors::SparseFactors() {
  factors_.cholmod().print = 0;
}

void SparseFactors::analyze(const SparseMatrix& matrix) {
  factors_.analyzePattern(matrix);
}

bool SparseFactors::factor(const SparseMatrix& matrix, double shift) {
  const OneThread one_thread;
  factors_.setShift(shift);
  factors_.factorize(matrix);
  return factors_.info() == Eigen::Success;
}

}  // namespace trocar::finite_elements
