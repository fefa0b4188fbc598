#pragma once

// Every experiment, in the order of the report. To add one: write its function, declare it here,
// and list it in experiments.cpp.

#include <vector>

#include "tests/validation/lab.h"

namespace trocar::validation {

struct Experiment {
  const char* name;    // as --only knows it
  const char* title;   // for people
  const char* source;  // what it is compared with
  void (*run)(const Lab& lab, Section& section);
};
const std::vector<Experiment>& experiments();

void run_eq2(const Lab& lab, Section& section);
void run_fig2_users(const Lab& lab, Section& section);
void run_fig3_transverse(const Lab& lab, Section& section);
void run_fig4_hysteresis(const Lab& lab, Section& section);
void run_fig5_profiles(const Lab& lab, Section& section);
void run_fig6_times(const Lab& lab, Section& section);
void run_fig7_fig8_organs(const Lab& lab, Section& section);
void run_creep(const Lab& lab, Section& section);
void run_palpation(const Lab& lab, Section& section);
void run_relaxation(const Lab& lab, Section& section);

void run_plate(const Lab& lab, Section& section);
void run_refresh_rate(const Lab& lab, Section& section);
void run_refresh_cutting(const Lab& lab, Section& section);

void run_calculix_comparison(const Lab& lab, Section& section);
void run_locking(const Lab& lab, Section& section);
void run_dogan_creep(const Lab& lab, Section& section);
void run_dogan_live(const Lab& lab, Section& section);
void run_dogan_reduction(const Lab& lab, Section& section);

void run_feel(const Lab& lab, Section& section);

void run_propagation_lattice(const Lab& lab, Section& section);
void run_propagation_liver(const Lab& lab, Section& section);
void run_propagation_large_liver(const Lab& lab, Section& section);
void run_propagation_stomach(const Lab& lab, Section& section);
void run_bar(const Lab& lab, Section& section);
void run_cantilever(const Lab& lab, Section& section);
void run_indentation(const Lab& lab, Section& section);
void run_ties(const Lab& lab, Section& section);
void run_presses(const Lab& lab, Section& section);
void run_threads(const Lab& lab, Section& section);

}  // namespace trocar::validation
