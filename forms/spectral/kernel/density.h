/* ψ and its derivatives in the stretches, at every lane; the formulas are those that UFL and FFCx generated.
 *
 * generated(A, k) adds ψ, ψ_1, ψ_2, ψ_3, ψ_11, ψ_12, ψ_13, ψ_22, ψ_23, ψ_33 to A; k holds the stretches, then the
 * material's constants. With an extension k holds the stretches that are at least σ_f, what the true ones
 * differ from these, then the constants.
 */
#define VALUES 10
static const int hessian_index[3][3] = {{4, 5, 6}, {5, 7, 8}, {6, 8, 9}};

struct jet
{
  lanes psi, p[3], h[3][3];
};

static inline void density_at(const double s[3], const double *c, double value[VALUES])
{
#if EXTENDED
  double k[6 + CONSTANTS];
  for (int i = 0; i < 3; ++i)
  {
    k[i] = s[i] < c[THRESHOLD] ? c[THRESHOLD] : s[i];
    k[3 + i] = s[i] - k[i];
  }
  double *constants = k + 6;
#else
  double k[3 + CONSTANTS];
  for (int i = 0; i < 3; ++i)
    k[i] = s[i];
  double *constants = k + 3;
#endif
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

static __attribute__((noinline)) void density_psi(const lanes s[3], const double *c, mask wanted, struct jet *out)
{
  FOR_LANES
  {
    SKIP(wanted);
    double value[VALUES];
    const double x[3] = {LANE(s[0], l), LANE(s[1], l), LANE(s[2], l)};
    density_at(x, c, value);
    LANE(out->psi, l) = value[0];
  }
}

static __attribute__((noinline)) void density_p(const lanes s[3], const double *c, mask wanted, struct jet *out)
{
  FOR_LANES
  {
    SKIP(wanted);
    double value[VALUES];
    const double x[3] = {LANE(s[0], l), LANE(s[1], l), LANE(s[2], l)};
    density_at(x, c, value);
    for (int i = 0; i < 3; ++i)
      LANE(out->p[i], l) = value[1 + i];
  }
}

static __attribute__((noinline)) void density_ph(const lanes s[3], const double *c, mask wanted, struct jet *out)
{
  FOR_LANES
  {
    SKIP(wanted);
    double value[VALUES];
    const double x[3] = {LANE(s[0], l), LANE(s[1], l), LANE(s[2], l)};
    density_at(x, c, value);
    for (int i = 0; i < 3; ++i)
    {
      LANE(out->p[i], l) = value[1 + i];
      for (int j = 0; j < 3; ++j)
        LANE(out->h[i][j], l) = value[hessian_index[i][j]];
    }
  }
}
