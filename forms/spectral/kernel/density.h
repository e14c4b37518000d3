/* ψ and its derivatives in the stretches, at every lane; the formulas are those that UFL and FFCx generated.
 *
 * generated(A, k) adds ψ, ψ_1, ψ_2, ψ_3, ψ_11, ψ_12, ψ_13, ψ_22, ψ_23, ψ_33 to A. The first three of k are the
 * stretches; with an extension those raised to σ_f, and three more hold what the true ones differ from these. Three
 * stretches that decide between the cases of a formula follow, then the material's constants.
 *
 * The deciding stretches are those of the point whose stress or tangent is wanted, also where the integrals below
 * need ψ elsewhere: one case is a smooth function, and integrating its derivatives across its border is exact.
 */
#define VALUES 10
static const int hessian_index[3][3] = {{4, 5, 6}, {5, 7, 8}, {6, 8, 9}};

struct jet
{
  lanes psi, p[3], h[3][3];
};

static inline double raised(double s, const double *c) { return EXTENDED && s < c[THRESHOLD] ? c[THRESHOLD] : s; }

static inline void density_at(const double s[3], const double deciding[3], const double *c, double value[VALUES])
{
  double k[6 + 3 * EXTENDED + CONSTANTS];
  double *decide = k + 3 + 3 * EXTENDED, *constants = decide + 3;
  for (int i = 0; i < 3; ++i)
  {
    k[i] = raised(s[i], c);
    if (EXTENDED)
      k[3 + i] = s[i] - k[i];
    decide[i] = raised(deciding[i], c);
  }
  for (int i = 0; i < CONSTANTS; ++i)
    constants[i] = c[i];
  for (int i = 0; i < VALUES; ++i)
    value[i] = 0;
  generated(value, k);
}

/* Logarithms and powers are calls, one lane after the other: lanes that do not count are left out. */
#if DENSITY_CALLS
#define SKIP(wanted) if (!LANE(wanted, l)) continue
#else
#define SKIP(wanted) (void)wanted
#endif

/* Of one point a call would take longer than the formulas of many an energy. */
#if LANES == 1
#define INLINE_AT_ONE_POINT inline __attribute__((always_inline))
#else
#define INLINE_AT_ONE_POINT __attribute__((noinline))
#endif

#define DENSITY(name, ...)                                                                                             \
  static INLINE_AT_ONE_POINT void name(const lanes s[3], const lanes deciding[3], const double *c, mask wanted, \
                                             struct jet *out)                                                         \
  {                                                                                                                    \
    FOR_LANES                                                                                                          \
    {                                                                                                                  \
      SKIP(wanted);                                                                                                    \
      double value[VALUES];                                                                                            \
      const double x[3] = {LANE(s[0], l), LANE(s[1], l), LANE(s[2], l)};                                               \
      const double d[3] = {LANE(deciding[0], l), LANE(deciding[1], l), LANE(deciding[2], l)};                          \
      density_at(x, d, c, value);                                                                                      \
      __VA_ARGS__                                                                                                      \
    }                                                                                                                  \
  }

/* Three variants: the compiler leaves out of each what is not stored. */
DENSITY(density_psi, LANE(out->psi, l) = value[0];)
DENSITY(density_p, for (int i = 0; i < 3; ++i) LANE(out->p[i], l) = value[1 + i];)
DENSITY(density_ph, for (int i = 0; i < 3; ++i) {
  LANE(out->p[i], l) = value[1 + i];
  for (int j = 0; j < 3; ++j)
    LANE(out->h[i][j], l) = value[hessian_index[i][j]];
})
