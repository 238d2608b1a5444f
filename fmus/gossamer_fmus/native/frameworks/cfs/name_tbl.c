/* Parameters of {{description}}. Written by gossamer flight; change them, then build the table anew. */
#include "cfe_tbl_filedef.h"

#include "{{name}}_app.h"

{{NAME}}_Table_t {{Name}}Table = {
    ({{name}}_real){{period}}, /* period [s] */
    {
{{starts}}
    },
};

CFE_TBL_FILEDEF({{Name}}Table, {{NAME}}.Parameters, Parameters of {{name}}, {{name}}_tbl.tbl)
